"""The key ring: the secrets that sign packets, in a private file.

``ring`` has the entries, ``toml_form`` the format, ``ring_file`` the file and its permissions;
``watch`` applies changes to a running server. No error, ``repr`` or log contains a secret.
"""
