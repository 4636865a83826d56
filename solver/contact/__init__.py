"""Contact laws: Coulomb friction with separation, its march through a period, masses on sliders, Archard's wear law."""
