"""Parameters from logs, without a diagnosis.

================  ==================================================================
file              what
================  ==================================================================
`base_columns`    sums of a serial arm's parameters that motion determines
`estimator`       sample by sample, as a controller would
`identification`  from whole logs by least squares, scheme by scheme
`fitting`         by output error
================  ==================================================================
"""
