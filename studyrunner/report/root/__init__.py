"""The joint in three dimensions: outer faces and the contact pairs on them, as figures, on the page, as VTU files."""
