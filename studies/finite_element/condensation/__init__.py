"""Static condensation of sparse structures: nested dissection, elimination in dense blocks, projection, modes."""
