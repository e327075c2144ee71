"""Pages in a browser: the hand that they share (pages/hand.js)."""
