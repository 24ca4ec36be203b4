"""What a layer of a drawing holds, by its name: AIA's groups, and words of the larger languages."""

import re
from unicodedata import combining, normalize

WORDS = {
    "annotation": (
        "anno text txt dim bemass cota acot quot note tag symb title titl ttlb legend label schrift"
        " beschrift etiquet rotul testo testi teks iden grid axis axes achs rast hatch patt schraff"
        " hachur tratteg sombr defpoint vport viewport border clng ceiling roof lite elec"
        " flooring tile paving pavim fliese parket parquet carpet projec ovhd"
        " текст размер штрих оси 文字 标注 轴 填充 寸法 注記"
    ),
    "furniture": (
        "furn eqpm equip mobel moebel mobil meubl muebl movei arred meubel mebl mebel nabyt"
        " huonekal bútor sanit fixt plumb casework appl schrank sofa chair desk wardrobe einricht"
        " stair strs trepp escal мебел лестн 家具 洁具 楼梯"
    ),
    "wall": (
        "wall wand waend wande mauer mur muro mura muri pared paret cloison tabique tramezz alvenar"
        " scian sten stena seina vagg vegg væg duvar zid fal стен 墙 牆 壁"
    ),
    "window": (
        "glaz glass window fenet fenster ventan finestr serrament infiss janela raam kozijn okn"
        " pencere ikkun fonster vindu ablak окн 窗 窓"
    ),
    "door": (
        "door porte porta puert tur turen tuer tueren deur drzwi dver vrata kapi kapı ovi ovet dorr"
        " dør ajto двер 门 門 扉 ドア"
    ),
}
"""Beginnings or ends of words in names, by what a layer holds; the first that fits counts."""

NOT_DOORS = ("indoor", "outdoor", "ovid")


def role_of(*names: str) -> str:
    """What the first name that says so has: a key of WORDS, or ``other``.

    >>> role_of("A-WALL-INTR"), role_of("Innentüren"), role_of("0", "SOFA_2"), role_of("Layer1")
    ('wall', 'door', 'furniture', 'other')
    """
    for name in names:
        plain = "".join(c for c in normalize("NFKD", name.casefold()) if not combining(c))
        words = set(re.findall(r"[^\W\d_]+", plain)) - set(NOT_DOORS)
        for role, known in _KNOWN.items():
            if any(_fits(word, part) for word in words for part in known):
                return role
    return "other"


def _fits(word: str, part: str) -> bool:
    if not part.isascii():
        return part in word
    # Short beginnings are those of many words: all but a plural.
    short = len(part) < 4 and len(word) > len(part) + 1
    return word.endswith(part) or (word.startswith(part) and (not short or part == "dim"))


_KNOWN = {
    role: ["".join(c for c in normalize("NFKD", part) if not combining(c)) for part in text.split()]
    for role, text in WORDS.items()
}
