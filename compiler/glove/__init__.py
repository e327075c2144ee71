"""The reduced glove, ready to build: where its switches lie, how they are wired, what to buy, what to expect."""
