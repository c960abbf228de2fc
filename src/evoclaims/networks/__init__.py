"""Networks: what a policy is made of."""
