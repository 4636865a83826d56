"""The contact law through one period: Coulomb friction with separation, masses on sliders, their tangents."""
