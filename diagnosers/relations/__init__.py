"""Relations between the readings of a healthy vehicle, fitted to its logs, and their residuals."""
