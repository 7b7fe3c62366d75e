"""The whole machine as one compiled function: packed from a built `Machine`, calling the same laws; mechanics only here."""
