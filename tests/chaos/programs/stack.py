"""A stack as bad as they come: it listens, daemonises a part, and may ignore SIGINT."""

import os
import random
import signal
import socket
import sys
import time

chance = random.Random(int(sys.argv[1]))
listener = socket.create_server(("127.0.0.1", 0))
if chance.random() < 0.3:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    time.sleep(600.0)
else:
    for _ in range(3):
        if os.fork() == 0:
            time.sleep(600.0)
    while True:
        print("going on", flush=True)
        time.sleep(0.05)
