"""Many measurements: sets of files, measured by many workers, each once.

manifest  what a set consists of, and what is said of each file
listing   a table of files
jobs      one file: what is asked, what becomes of it, where that is kept
measuring one file, as a worker measures it
workers   processes of this machine, or a Dask cluster, behind one interface
ledger    what is done, what was tried, and who may write
running   every job once, whatever dies
columns   what the tables call their columns
tables    from rows to tables, and what is rejected
effects   what the factors do
drawing   the shaper and the figures of a subset
ahead     subsets that are drawn while others are still measured
subsets   those of all subsets, each drawn where something changed
output    everything that a set's measurements tell together
page      report.html
batch     all of it
watching  all of it, again and again, as a folder is being filled
"""
