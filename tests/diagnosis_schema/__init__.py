"""Many diagnoses against their JSON Schema, and through the typed result and back.

``python -m tests.diagnosis_schema --seed S --cases N`` makes cases of planar arms (`armgap.trial`) and of serial arms (`tests.serial_trial`),
diagnoses them and counts what does not fit the schema or changes on the way.
"""
