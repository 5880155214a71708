"""The page that plans: its core in JavaScript, and what Python writes into it."""
