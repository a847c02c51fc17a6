"""Bytes to messages and back, pure: parsers are objects with feed(bytes) that count and drop what is
wrong.
"""
