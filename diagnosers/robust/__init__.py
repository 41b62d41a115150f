"""The filter bank: filters of seven states, readings with heavy tails, compiled."""
