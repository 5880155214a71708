from benchmarks.calibration.others import *

for n in SETS:
    v = calibrated(n, "/work/shared/measured/real/ship_captive.csv" if n == "ship" else None)
    print(n, v.verdict, "|", v.sentence, "|", v.errors_in_words)
    r = facts(v)
    print(
        "   gain",
        r["gain_interval"],
        [(f["title"], round(f["error"], 4), round(f["size"], 3)) for f in r["forms"]],
        [(t["named"], t["error"], t["left"]) for t in r["turns"]],
        r["withdrawn"],
    )
