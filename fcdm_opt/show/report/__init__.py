"""The report: one HTML file about problems and their solutions (`gather` collects the data, `page` writes the text)."""
