"""The filter bank: one Kalman filter per fault and severity grade, compiled."""
