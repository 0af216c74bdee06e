"""Plant and regulator together: sampled plants, margins, and the check of moving gains."""
