"""The subjective study of the paper: plan, ledger, conduct, and the analysis of ratings. Knows no configuration."""
