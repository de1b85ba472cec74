"""Shared parts of the engines of imperfect worlds: true links, closest approaches and the ledger beside what acts."""
