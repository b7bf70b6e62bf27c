"""The profiles that Fast DDS reads: who is found how soon, and which network interfaces are used."""
