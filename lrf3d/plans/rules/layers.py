"""Names of layers, blocks and groups: the role that a name gives, and how it is encoded.

A name enters; a role leaves, such as wall, door, furniture or annotation. Old DXF files, and PDF
files made of them, declare no encoding of names, or a wrong one.
"""

import re
from collections.abc import Sequence
from unicodedata import combining, normalize

from lrf3d.plans.canvas import Canvas

# Beginnings or ends of words in names, by the role that they give; roles are tried in this order.
WORDS = {
    "annotation": (
        "anno text txt teks dim bemass cota acot koty quot wymi maatv misure note tag symb simb"
        " title titl titul titel ttlb legend leyend label schrift beschrift etiquet rotul testo"
        " testi texto scritt opis cajetin cartigl cartouch tabel stempel iden grid raster stramien"
        " axis axes achs assi ejes eixo osie hatch patt schraff hachur tratteg sombr arcer kresk"
        " retin skrav defpoint vport viewport border clng ceil roof lite elec echel escala"
        " podzial masstab schaal flooring tile paving pavim fliese"
        " fluchtweg rettungsplan evac egress landscap plnt parket parquet carpet projec ovhd"
        " текст размер штрих оси осей штамп легенд масштаб надпис выноск экспликац отмет потол"
        " кровл розмір"
        " 文字 注记 注释 标注 标高 尺寸 轴 图框 图例 填充 吊顶 天花 屋顶 绿化 植物 索引 辅助 梁"
        " 標註 標高 註 軸 圖框 圖例 寸法 注記 記号 通り 基準 芯 図枠 表題 グリッド ハッチ 引出"
        " 補助 屋根 天井 植栽 方位 窗帘 カーテン"
        " 치수 문자 중심선 해치 도곽 지붕 천장 조경"
    ),
    "furniture": (
        "furn eqpm equip fitting mobel moebel mobil meubl meubel muebl movei arred mebl mebel nabyt"
        " huonekal bútor sanit fixt plumb casework appl schrank sofa chair desk wardrobe einricht"
        " shelf shelv couch bench table bed sink toilet"
        " lvtry stair strs trepp trap escal schod scala scale мебел мебл лестн оборуд сантех"
        " 家具 家俱 傢 洁具 潔具 卫生 衛生 设备 設備 柜 櫃 沙发 便器 楼梯 樓梯 階段 가구 위생 계단"
    ),
    "wall": (
        "wall wand waend wande mauer mur muro mura muri pared paret peret cloison tabique tramezz"
        " alvenar scian sten stena seina vagg vegg væg duvar dinding zid fal"
        " стен стін перегород колон τοιχ קיר جدار 墙 牆 壁 隔断 隔間 間仕切 躯体 柱 벽 기둥"
    ),
    "window": (
        "glaz glass window fenet fenster ventan finestr serrament infiss janela raam ramen kozijn"
        " okn pencere ikkun fonster vindu ablak jendela fereastr окн вікн παραθ חלון نافذ 窗 窓"
        " 建具 サッシ 창"
    ),
    "door": (
        "door porte porta puert tur turen tuer tueren deur drzwi dver vrata kapi kapı ovi ovet dorr"
        " dør ajto pintu двер πορτ דלת باب 门 門 扉 戸 ドア 문"
    ),
    # The last, as windows and doors have frames, too; the role of a sheet is ``annotation``.
    "sheet": (
        "frame rahmen cadre marco ramk kader squadr cornice sheet nord north norte noord polnoc"
        " рамк север"
    ),
}

# Encodings of names, the likeliest first.
ENCODINGS = (
    "utf-8 cp1252 cp1250 cp1251 cp1253 cp1254 cp1255 cp1256 cp1257 cp932 gbk big5 cp949"
    " cp866 cp850 cp852 mac_roman utf-16-be"
)

_KNOWN = {
    role: ["".join(c for c in normalize("NFKD", part) if not combining(c)) for part in text.split()]
    for role, text in WORDS.items()
}


def role_of(*names: str) -> str:
    """The role that the first recognised name gives: a key of WORDS, or ``other``.

    >>> role_of("A-WALL-INTR"), role_of("Innentüren"), role_of("0", "SOFA_2"), role_of("L-PLNT")
    ('wall', 'door', 'furniture', 'annotation')
    """
    for name in names:
        plain = "".join(c for c in normalize("NFKD", name.casefold()) if not combining(c))
        # Matplotlib puts a whole drawing in "axes_1", and these words are not about doors.
        words = set(re.findall(r"[^\W\d_]+", re.sub(r"^axes_\d+$", "", plain)))
        words -= {"indoor", "outdoor", "ovid"}
        for role, known in _KNOWN.items():
            if any(_means(word, part) for word in words for part in known):
                return "annotation" if role == "sheet" else role
    return "other"


def _means(word: str, part: str) -> bool:
    if not part.isascii():
        return part in word
    # Many words begin with the same few letters: a short part begins only its own plural.
    short = len(part) < 4 and len(word) > len(part) + 1
    return word.endswith(part) or (word.startswith(part) and (not short or part == "dim"))


def rename(canvas: Canvas, encoding: str) -> None:
    """Decode the names of marks again, in the encoding in which most of them are known words.

    The encoding that is given is the one by which the reader decoded them.
    """
    names = dict.fromkeys(name for mark in canvas.marks for name in (mark.layer, *mark.names))
    foreign = [name for name in names if not (name.isascii() and name.isprintable())]
    # By chance, a few of many names are known words in a wrong encoding, too.
    most = max(_known(foreign), len(foreign) // 3)
    found = dict[str, str]()
    for each in ENCODINGS.split():
        try:
            read = [name.encode(encoding, "surrogateescape").decode(each) for name in foreign]
        except UnicodeError:
            continue
        if _known(read) > most:
            most = _known(read)
            found = dict(zip(foreign, read, strict=True))
            canvas.said = f"layer names read as {each}"
    if found:
        canvas.marks = [
            mark._replace(
                layer=found.get(mark.layer, mark.layer),
                names=tuple(found.get(name, name) for name in mark.names),
            )
            for mark in canvas.marks
        ]


def _known(names: Sequence[str]) -> int:
    return sum(role_of(name) != "other" for name in names)
