"""The study of `adaptive`: how often it sends, what is felt, what each of its parts is worth, and what it costs.

`signals` says what is coded and which half of it chose the parameters, `variants` what codes it (with `shadows`),
`coding` runs it, `work` is all that is done with one signal, `rows` what is kept of it. `comparison`, `packets` and
`verdict` judge, `document`, `tables`, `losses`, `words` and `figures` show. `filters` makes the filters of
`weberlink.codec.adaptive.trend` again.
"""
