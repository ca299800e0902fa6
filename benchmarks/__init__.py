"""The `bench` command: real-time and throughput figures beside the machine's own limits, all in one run.

One measurement a module; `study` puts them in order, `targets` judges, `report`, `figures` and `baseline` show. Each
limit is measured in the same run, before and after what it is the limit of.
"""
