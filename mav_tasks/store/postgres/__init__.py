"""The store in a PostgreSQL database. Importing it raises StoreError without the package psycopg.

``session`` sends SQL, ``ownership`` decides which server may write, ``database`` writes batches.
"""

from mav_tasks.basics.errors import StoreError, missing

try:
    import psycopg as psycopg
except ImportError as error:  # it, or its compiled part
    raise StoreError(missing("psycopg", "fleet")) from error
