"""The key ring: the secrets with which packets are signed, in a file that only its user can read.

``ring`` is what it holds, ``toml_form`` how that is written, ``ring_file`` where, and who may read
it, ``watch`` has a running server take changes at once. No error, ``repr`` or log has a secret.
"""
