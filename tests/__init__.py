"""Test packages: `from tests.oracle import ...` works because the repository root is the import root."""
