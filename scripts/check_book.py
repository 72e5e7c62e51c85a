"""Looks at every link inside a built book: the page is there, and so is its anchor.

    python3 scripts/check_book.py target/book

Exit code 1 and a line for each broken link. Links to other hosts are not followed.
"""

import pathlib
import sys
from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """Links and anchors of one page."""

    def __init__(self, text):
        super().__init__()
        self.links, self.anchors = [], {"", "top"}
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.anchors.update(value for key, value in attrs.items() if key in ("id", "name") and value)
        for key in ("href", "src"):
            if attrs.get(key):
                self.links.append(attrs[key])


def broken(book):
    """Each broken link as page, link and reason; and how many links were looked at."""
    pages = {path.resolve(): Page(path.read_text("utf-8")) for path in book.rglob("*.html")}
    found, n_links = [], 0
    for path, page in pages.items():
        # Its links are those of the root, wherever it is served.
        if path.name == "404.html":
            continue
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            n_links += 1
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                found.append((path, link, "no such file"))
            elif target in pages and unquote(parts.fragment) not in pages[target].anchors:
                found.append((path, link, "no such anchor"))
    return found, n_links


book = pathlib.Path(sys.argv[1])
found, n_links = broken(book)
for path, link, reason in found:
    print(f"{path.relative_to(book.resolve())}: {link}: {reason}", file=sys.stderr)
print(f"{book}: {n_links} links, {len(found)} broken")
sys.exit(1 if found or n_links == 0 else 0)
