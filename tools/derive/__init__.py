"""Physical parameters -> models -> gains: what config/generated holds, and the checks behind it."""
