"""The prose of a page, and how much of it is in the dialect that the pages once had."""

import re
import statistics

DIALECT = {
    "things that tell": r"\b(?:tells?|told|telling)\b",
    "things that say": r"\b(?:says?|said|saying)\b",
    "nobody, whoever": r"\b(?:nobody|somebody|whoever)\b",
    "a clause for a noun": r"\b(?:what|who) (?:is|are|was|were|has|have|had|can|cannot|may|no|counts|hangs|lies)\b",
    "where for if": r"(?:^|[.;:] )Where\b[^.?]*,|\bwherever\b"
    r"|\bwhere (?:it|they|that|there|this|one|none) (?:is|are|was|does|do|has|have|had|can)\b",
    "things that stand or lie": r"\b(?:stands?|stood|standing)\b(?! still)|\b(?:lies|lay|lying)\b",
    "things that take": r"\btakes? (?:it|them|that|this|what|both|away)\b",
    "things that ask": r"\b(?:asks|asked)\b(?! (?:you|a|for your|six|before)\b)",
    "things that want": r"(?<!you )\bwant(?:s|ed)?\b",
    "hold, bear": r"\b(?:held|bears?|borne)\b",
    "looks": r"\b(?:a|flat|second|one|two|of|first|other|another) looks?\b|\blooked at\b",
    "whole": r"\bwhole\b",
    "of its own": r"\bof (?:its|their) own\b",
    "beside": r"\bbeside\b",
    "so many": r"\bso many\b|\bas (?:light|cheap)\b(?! as)",
    "way": r"\b(?:each|both|one|other|other's|wrong|in the) ways?\b(?! (?:to|of)\b)",
    "old words": r"\b(?:shall|yet|aslant|dear|to and fro|mend(?:s|ed|ing)?|unasked|for ever|likewise|whence)\b",
    "house": r"\b(?:the house|rooms? of (?:the|what|its)|at hand|by hand|in hand)\b",
    "left out": r"\b(?:left|leaves?|leaving) out\b|\bleaves? [^.]{,40} out\b",
    "history": r"\b(?:no longer|had been|the code before|used to be)\b",
    "private words": r"\b(?:twins?|refused?|leaders?|crisp|unrest)\b",
}


def blocks(markdown):
    """Return the paragraphs, list items and headings of a page as pairs of kind and text, without code.

    Kinds: `heading`, `cell` (of a table), `text`. A name or command in backquotes is one word. Left out are fenced
    blocks, comments, pictures, and what a script writes (between `<!-- table: NAME -->` and `<!-- end -->`).
    """
    text = re.sub(r"<!-- table: .*?<!-- end -->|<!--.*?-->", "", markdown, flags=re.DOTALL)
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", "", "\n".join(_outside_fences(text.splitlines())))
    text = re.sub(r"`[^`]+`", "`code`", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    for paragraph in re.split(r"\n\s*\n|\n(?= *(?:[-*]|\d+\.) )|\n(?=[|#>:])|(?<=\|)\n|(?<=[^\n])\n(?=: )", text):
        words = " ".join(paragraph.split())
        if re.match(r"#+ ", words):
            yield "heading", words.lstrip("# ")
        elif words.startswith("|"):
            if not set(words) <= set("|- :"):
                yield from (("cell", cell.strip()) for cell in words.strip("|").split("|") if cell.strip())
        elif words := re.sub(r"^(?:[-*>:]|\d+\.) ", "", words):
            yield "text", words


def _outside_fences(lines):
    """Return the lines of a page outside fenced code; a note or warning is text although it is fenced."""
    fence = None
    for line in lines:
        mark = re.match(r" *(`{3,})(.*)", line)
        if mark is None:
            if fence in (None, "text"):
                yield line
        elif fence is None:
            fence = "text" if mark[2] in ("{note}", "{warning}", "{tip}") else "code"
            yield ""
        else:
            fence = None
            yield ""


def sentences(markdown):
    """Return the sentences of the running text of a page; what a colon introduces belongs to its sentence."""
    texts = (text for kind, text in blocks(markdown) if kind == "text")
    return [one for text in texts for one in re.split(r"(?<=[.!?])[*_)\"]* +(?=[A-Z`*\"(\d])", text) if words(one)]


def words(text):
    """Return the words of a text."""
    return re.findall(r"[^\W_][\w'.,/%-]*", text.replace("`code`", "code"))


def median_sentence(markdown):
    """Return the median length of the sentences of a page in words."""
    return statistics.median([len(words(sentence)) for sentence in sentences(markdown)] or [0])


def strange(markdown):
    """Return the places of a page that are in dialect, as (kind, words around it)."""
    found = []
    for kind, text in blocks(markdown):
        for sentence in re.split(r"(?<=[.!?]) ", text):
            if kind == "heading" or sentence.rstrip("*_ ").endswith("?"):
                continue
            for name, pattern in DIALECT.items():
                places = re.finditer(pattern, sentence, re.IGNORECASE)
                found += [(name, sentence[max(0, place.start() - 30) : place.end() + 30]) for place in places]
    return found


def count_words(markdown):
    """Return the number of words of the prose of a page, its tables included."""
    return sum(len(words(text)) for _, text in blocks(markdown))
