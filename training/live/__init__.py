"""The live page of ``auv-fault watch``: a vehicle that a person runs and breaks, and what is made of it."""
