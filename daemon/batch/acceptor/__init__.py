"""Accepts TLS connections for the daemon; passes on those that get on with their handshake.

Zenoh 1.10.2 lets 64 handshakes wait for ten seconds each and accepts nobody else meanwhile: seven
silent connections a second close its port. After each handshake that failed it rests 0.1 s, so ten
failures a second close it too. Therefore the port is this process's, and Zenoh listens behind it,
on loopback: silence stays here, and few failures of one address are let through. A connection
goes through these states:

silent    accepted; its ClientHello has not come, and Zenoh does not know of it
waiting   its ClientHello has come, others are at their handshakes
greeted   its ClientHello was passed on; few at a time, fairly among addresses
open      the handshake is done, which takes a certificate of the authority: bytes pass both ways

Nothing is decrypted: certificates are shown to Zenoh, and it is Zenoh that trusts them. Whether a
handshake is done shows in the types of records (RFC 8446, 5.1): the daemon's side has said
something after the client's first encrypted record.

A process of its own, so that neither a busy daemon nor Python's lock delays a link; it imports the
standard library only. ``python -m daemon.batch.acceptor FD PORT`` serves the listening socket FD
until standard input ends.
"""

from daemon.batch.acceptor._acceptor import MOST_GREETED, MOST_SILENT_EACH, Acceptor

__all__ = ["MOST_GREETED", "MOST_SILENT_EACH", "Acceptor"]
