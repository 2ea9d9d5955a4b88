"""What people look at: figures, one self-contained page, and the words for both.

It draws what `Result` and `Curves` hold and computes nothing; lengths become millimetres here, because people read
them.
`words` needs neither matplotlib nor Jinja, so the command can speak without loading either.

`plotly-basic.min.js` is the basic bundle of plotly.js 3.7.0, unchanged, under the licence beside it; the page carries
it so that it opens without a network.
"""
