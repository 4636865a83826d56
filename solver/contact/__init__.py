"""Contact laws: Coulomb friction with separation, march through a period, masses on sliders, Archard's wear law."""
