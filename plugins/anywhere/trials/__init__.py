"""Two hosts behind NATs of every kind meet, and their paths fail in contact: `python -m plugins.anywhere.trials`."""
