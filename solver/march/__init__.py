"""Steps along a line of states, whose lengths follow from one rule."""
