"""Plant and regulator together: what is controlled, plants of every kind, margins, hidden
coupling."""
