"""Check of many diagnoses against their JSON Schema, and of the typed result that is read from and written to JSON.

``python -m tests.diagnosis_schema --seed S --cases N`` makes cases of planar arms (`armgap.trial`) and of serial arms (`tests.serial_trial`),
diagnoses them and counts the diagnoses that do not fit the schema or change when read and written.
"""
