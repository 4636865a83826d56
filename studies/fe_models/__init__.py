"""From the files of a finite-element code to a scene: decks and meshes, matrices, and what is wrong with them."""
