"""Many cases: study files, tasks on MPI ranks, result files and the command line."""
