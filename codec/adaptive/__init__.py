"""The sender's part of `adaptive`: what it learns from all of its samples, and how it chooses what to send.

`history` keeps the latest samples. A candidate is a way to make a model of them: `trend`, `affine` and `surface` (which
follows the contact tick by tick in `contact`) estimate parameters, `fitted` stands for the paper's predictors. A
`shadow` runs a deadband loop of its own for each candidate and counts how often that would have sent, and `choice`
sends the one with the best record. Of all this the receiver knows nothing: the choice and the parameters travel in the
update.
"""
