"""What a model predicts: stiffness with bands, what these cannot say, and two results side by side."""
