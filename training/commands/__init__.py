"""One module per sub-command of ``auv-fault``, each with a function `main`."""
