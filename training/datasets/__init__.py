"""Published data of real vehicles: read strictly, as they were published. The data are given by their folder."""
