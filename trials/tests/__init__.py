"""Each trial for some seconds, so that it still runs; `trials` has the whole of them."""
