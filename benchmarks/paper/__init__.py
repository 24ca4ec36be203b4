"""The paper, redone: every figure and claim of Teslić, Škrjanc and Klančar, measured.

Each module measures some of the claims; the report puts them onto one page.
"""
