"""A participant that speaks ``rmw_zenoh``: the transport that needs no relay. Experimental."""
