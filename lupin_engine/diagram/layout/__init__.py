"""Layered drawing of compound directed graphs; knows no chart.

The method is Sugiyama's (Sugiyama, Tagawa and Toda 1981) as Gansner, Koutsofios, North and Vo give it in "A
technique for drawing directed graphs" (1993): `ranking` assigns ranks, `ordering` reduces crossings,
`coordinates` computes x coordinates, ranks and coordinates with `network_simplex`; `routing` assigns the
horizontal segments between two ranks to tracks. `cluster` draws the children of one compound node,
`compound` combines the nested ones.
"""
