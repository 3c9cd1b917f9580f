# Stands in for the relay beside a stack that nobody speaks to: it stays, and says nothing.
exec sleep 605
