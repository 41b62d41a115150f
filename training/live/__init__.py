"""The live page of ``auv-fault watch``: a simulated vehicle, its faults and their diagnosis."""
