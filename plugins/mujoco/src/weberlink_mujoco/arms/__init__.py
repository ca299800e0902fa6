"""Arms that MuJoCo computes, and models of arms. MuJoCo is imported when a model is loaded."""
