"""Stop every rover when Enter is pressed. Nothing runs until somebody resumes.

Usage: python stop_button.py [URL of the task server]
"""

import sys

from mav_tasks import NoAnswer, Refused, SyncClient

url = sys.argv[1] if len(sys.argv) > 1 else "udpout:127.0.0.1:14560"

with SyncClient(url) as tasks:
    input("Enter stops every rover: ")
    try:
        tasks.stop()
    except Refused as why:  # the STOP stays in force, and reaches a silent rover when it is back
        print("STOP is in force, but:", why)
    except NoAnswer:
        sys.exit("NO ANSWER: use the switch on the rover")
    else:
        print("stopped; to resume: mav-tasks resume --all")
