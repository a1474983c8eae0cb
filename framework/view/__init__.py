"""The local web page on a terrain database: `bevameter view`."""
