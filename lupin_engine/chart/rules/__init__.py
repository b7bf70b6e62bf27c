"""The rules about a composed chart, by subject; `chart.checks` runs them."""
