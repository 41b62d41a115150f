"""The Gaussian bank: a Kalman filter per fault and severity grade, compiled; and common parts."""
