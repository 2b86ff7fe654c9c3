"""Parameters of a diagnosis beside inverse-dynamics least squares, on the halves of a real log; both scored by the same regressor and filter."""
