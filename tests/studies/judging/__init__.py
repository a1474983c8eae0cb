"""How well `bevameter explain` answers: the sets of recordings, the runs over them, the scorer and its table."""
