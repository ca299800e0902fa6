"""Links that record when each datagram left and arrived, and whole sessions in which no force is without a contact."""
