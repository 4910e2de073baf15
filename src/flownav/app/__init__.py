"""A page on this machine for who does not type: logs, GPS cuts, flights, campaigns and certificates in a browser.

`server.py` serves it to this machine alone (`doors.py`: who may ask), `shelf.py` is its folder, `uploads.py` what is
dropped in, `tasks.py` the commands that its buttons stand for, `jobs.py` these commands as child processes, and
`warm.py` the process that stays warm for what must answer within a second. `static/` has its plain modules.
"""
