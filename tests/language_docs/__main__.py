"""Write the made parts of the documentation anew: ``python -m tests.language_docs``."""

from tests.language_docs.regions import made_pages

for page, text in made_pages():
    if page.read_text("utf-8") != text:
        page.write_text(text, "utf-8")
        print(page)
