"""Estimation of an arm's parameters from logs, without a diagnosis.

================  ==================================================================
file              what
================  ==================================================================
`base_columns`    combinations of a serial arm's parameters that motion determines
`estimator`       online estimation, sample by sample
`identification`  recursive least squares over whole logs, by three schemes
`fitting`         output error
================  ==================================================================
"""
