"""A gateway's part in its fleet: leases in PostgreSQL, pings between gateways, and their thread.

The rules are in ``mav_tasks.fleet``; here are the sockets, sessions and clocks that they need.
"""
